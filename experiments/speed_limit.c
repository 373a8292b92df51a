/* One period of WIDTH environments in C: the limit that the compiled Python is measured against.

Impedance, constant speed, chirp of the hand, Dahl frictions, kinematic slip: what the environments do by default. The
equations are those of steer_env/physics, written out once more by hand; experiments/speed_limit.py generates layout.h
(the rows of a block), compiles this file and checks that both give the same motion. */

#include <math.h>
#include <string.h>
#include "layout.h"

#define B(row) b[row][n]
#define EACH_LANE for (int n = 0; n < WIDTH; n++)
#define MOST(a, b) ((a) > (b) ? (a) : (b))
#define LEAST(a, b) ((a) < (b) ? (a) : (b))
typedef double lane[WIDTH];

static const double TO_INTEGER = 6755399441055744.0;

static inline double exponential(double x) {
    double scaled = MOST(x, -700.0) * 1.4426950408889634;
    double shifted = scaled + TO_INTEGER, f = scaled - (shifted - TO_INTEGER), f2 = f * f, f4 = f2 * f2, power;
    double low = (0.24022650695910075 + 0.05550410866482158 * f) + (0.009618129107618634 + 0.0013333558146423196 * f) * f2;
    double high = (0.0001540353042485199 + 1.5252733820836028e-05 * f)
                  + (1.3215451576896747e-06 + 1.017806723742614e-07 * f) * f2;
    double q = low + (high + (7.070990735876959e-09 + 4.4541102704477153e-10 * f) * f4) * f4;
    long long bits;
    memcpy(&bits, &shifted, 8);
    bits = (bits << 52) + (1023LL << 52);
    memcpy(&power, &bits, 8);
    return (1.0 + (f * 0.6931471805599453 + f2 * q)) * power;
}

static inline void sine_cosine(double angle, double *sine, double *cosine) {
    double n = (angle * 0.6366197723675814 + TO_INTEGER) - TO_INTEGER;
    double turn = n - 4.0 * ((n * 0.25 + TO_INTEGER) - TO_INTEGER);
    double r = ((angle - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;
    double z = r * r, z2 = z * z;
    double s = r + r * z * ((-0.16666666666666666 + 0.008333333333330925 * z)
               + ((-0.00019841269836722418 + 2.755731608381636e-06 * z)
               + (-2.5051127944014188e-08 + 1.5917848524808262e-10 * z) * z2) * z2);
    double c = 1.0 - (0.5 * z - z2 * ((0.041666666666666664 - 0.0013888888888887382 * z)
               + ((2.480158729874307e-05 - 2.7557317260008837e-07 * z)
               + (2.0876143827993133e-09 - 1.1382456778061306e-11 * z) * z2) * z2));
    double odd = fabs(turn) == 1.0, half = fabs(turn) == 2.0;
    double first = odd ? c : s, second = odd ? s : c;
    *sine = (turn == -1.0) + half > 0.0 ? -first : first;
    *cosine = (turn == 1.0) + half > 0.0 ? -second : second;
}

static inline double dahl(double torque, double displacement, double level, double stiffness) {
    double limit = copysign(level, displacement);
    double moved = limit + (torque - limit) * exponential(-stiffness * fabs(displacement));
    return displacement == 0.0 ? torque : moved;
}

static inline double inverse_assist(double M_eff, double r, double sigma) {
    double target = fabs(M_eff), y = target / sigma, held = LEAST(y, 120.0);
    double fit = held * (1.0 + (1.988 + 0.1216 * held) * held) / (1.0 + (1.898 + (1.197 + 0.04083 * held) * held) * held);
    double u = MOST(fit, r * y);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        double gauss = (1.0 - r) * y * exponential(-0.5 * u * u);
        double error = u - r * y - gauss, slope = 1.0 + u * gauss;
        u -= error * slope / (slope * slope - 0.5 * error * gauss * (1.0 - u * u));
    }
    double M = MOST(u * sigma, target * (1.0 / 40.0));
    return copysign(LEAST(M, target), M_eff);
}

typedef struct { double a, w, p, v, vy, r, sf, sr; } motion;

#define COMBINE(x, h, k) (motion){x.a + (h) * k.a, x.w + (h) * k.w, x.p + (h) * k.p, x.v + (h) * k.v, \
    x.vy + (h) * k.vy, x.r + (h) * k.r, x.sf + (h) * k.sf, x.sr + (h) * k.sr}
#define MEAN(f) (x.f + (k0.f + 2.0 * (k1.f + k2.f) + k3.f) * (h * (1.0 / 6.0)))

typedef struct {
    double b_s, c_tb, b_tb, ratio, b_pin, stop, c_stop, b_stop, per_J_s, per_J_pin;
    double hand, hand_rate, hand_torque, grip, k, b, most;
    double share, per_ratio, load, extra, l_f, l_r, C_f, C_r, per_m, per_J_z, per_sigma_f, per_sigma_r, speed, per_speed;
} plant;

static inline motion rates(motion x, double wheel, double pinion, double motor, const plant *c) {
    double M_tb = c->c_tb * (x.a - x.p) + c->b_tb * (x.w - x.v);
    double wanted = c->grip * (c->k * (c->hand - x.a) + c->b * (c->hand_rate - x.w)) + c->hand_torque;
    double M_s = LEAST(MOST(wanted, -c->most), c->most);
    double beyond = fabs(x.p) - c->stop, out = copysign(1.0, x.p);
    double pushed = MOST(c->c_stop * beyond + c->b_stop * (x.v * out), 0.0);
    double M_stop = beyond > 0.0 ? pushed * out : 0.0;
    double tyre = x.p * c->per_ratio, slip = tyre - (x.vy + c->l_f * x.r) * c->per_speed;
    double M_rack = c->share * (c->load * slip + c->extra * x.p);
    double front = c->C_f * x.sf, rear = c->C_r * x.sr;
    return (motion){
        x.w, (M_s - M_tb - c->b_s * x.w - wheel) * c->per_J_s,
        x.v, (M_tb + c->ratio * motor - M_rack - M_stop - c->b_pin * x.v - pinion) * c->per_J_pin,
        (front + rear) * c->per_m - c->speed * x.r, (c->l_f * front - c->l_r * rear) * c->per_J_z,
        (c->speed * (tyre - x.sf) - x.vy - c->l_f * x.r) * c->per_sigma_f,
        (c->l_r * x.r - x.vy - c->speed * x.sr) * c->per_sigma_r};
}

static inline plant plant_of(lane *restrict b, int n) {
    plant c;
    c.b_s = B(P_STEERING_B_S), c.c_tb = B(P_STEERING_C_TB), c.b_tb = B(P_STEERING_B_TB);
    c.ratio = B(P_STEERING_MOTOR_RATIO), c.b_pin = B(P_STEERING_B_PIN), c.stop = B(P_STEERING_ANGLE_LIMIT);
    c.c_stop = B(P_STEERING_C_STOP), c.b_stop = B(P_STEERING_B_STOP);
    c.hand = B(B_HAND_ANGLE), c.hand_rate = B(B_HAND_RATE), c.hand_torque = B(B_HAND_TORQUE), c.grip = B(B_HAND_GRIP);
    c.per_J_s = 1.0 / (B(P_STEERING_J_S) + B(P_DRIVER_J) * c.grip), c.per_J_pin = 1.0 / B(P_STEERING_J_PIN);
    c.k = B(P_DRIVER_K), c.b = B(P_DRIVER_B), c.most = B(P_DRIVER_TORQUE_LIMIT);
    c.share = B(P_EPISODE_RACK_SHARE), c.per_ratio = 1.0 / B(S_CAR_I_S), c.extra = B(S_CAR_C_EXTRA);
    c.l_f = B(S_CAR_L_F), c.l_r = B(S_CAR_L_R), c.C_f = B(S_CAR_C_F), c.C_r = B(S_CAR_C_R);
    c.load = c.C_f * B(S_CAR_N_T) * c.per_ratio, c.per_m = 1.0 / B(S_CAR_M), c.per_J_z = 1.0 / B(S_CAR_J_Z);
    c.per_sigma_f = 1.0 / B(S_CAR_SIGMA_F), c.per_sigma_r = 1.0 / B(S_CAR_SIGMA_R);
    c.speed = B(B_WIRES_SPEED), c.per_speed = 1.0 / c.speed;
    return c;
}

/* Impedance generator: M_eff at a motion; its state lies in the eight rows from ``at`` on. */
static inline double felt(lane *restrict b, int n, int at, double angle, double rate, double acceleration) {
    double x[6] = {b[at + 2][n], b[at + 3][n], b[at + 4][n], b[at + 5][n], b[at][n], angle}, y[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; k++) {
        y[k] = 0.0;
#pragma GCC unroll 6
        for (int j = 0; j < 6; j++) y[k] += b[S_TRACK_LATERAL_OF_LATERAL + 4 * j + k][n] * x[j];
    }
    double friction = dahl(b[at + 6][n], angle - b[at][n], B(S_REFERENCE_M_FRIC_C), B(S_REFERENCE_C_FRIC) / B(S_REFERENCE_M_FRIC_C));
    double per_ratio = 1.0 / B(S_REFERENCE_I_S);
    double slip = angle * per_ratio - (y[0] + B(S_REFERENCE_L_F) * y[1]) * (1.0 / B(B_WIRES_SPEED));
    double load = B(S_REFERENCE_C_F) * B(S_REFERENCE_N_T) * per_ratio * slip + B(S_REFERENCE_C_EXTRA) * angle;
    double M_eff = B(S_REFERENCE_J_REF) * acceleration + B(S_REFERENCE_B_REF) * rate + load + friction;
    b[at][n] = angle, b[at + 1][n] = rate, b[at + 2][n] = y[0], b[at + 3][n] = y[1], b[at + 4][n] = y[2];
    b[at + 5][n] = y[3], b[at + 6][n] = friction, b[at + 7][n] = M_eff;
    return M_eff;
}

static inline double measured(double value, double step, double rms, double noise) {
    double noisy = value + rms * noise;
    return step <= 0.0 ? noisy : copysign(step * floor(fabs(noisy) / step + 0.5), noisy);
}

static void command_and_hand(lane *restrict b) {
    EACH_LANE {
        double last = B(S_COMMANDS_LAST_1), step = B(P_MOTOR_SLEW_RATE) * PERIOD, rated = B(P_MOTOR_RATED_TORQUE);
        double slewed = LEAST(MOST(B(B_WIRES_COMMAND), last - step), last + step);
        double t = (B(S_CLOCK_PERIOD) + 0.5) * PERIOD, s = t - B(P_MANOEUVRE_LEAD_IN), T = B(P_MANOEUVRE_DURATION);
        double f = B(P_MANOEUVRE_FREQUENCY), sweep = (B(P_MANOEUVRE_FREQUENCY_END) - f) / T, sine, cosine;
        sine_cosine(2.0 * M_PI * (f + 0.5 * sweep * s) * s, &sine, &cosine);
        double on = s <= 0.0 ? 0.0 : s >= T ? 0.0 : B(P_MANOEUVRE_AMPLITUDE);
        B(B_WIRES_LIMITED) = LEAST(MOST(slewed, -rated), rated);
        B(B_WIRES_PERIOD) = B(S_CLOCK_PERIOD), B(B_WIRES_SPEED) = B(S_CLOCK_SPEED);
        B(B_HAND_ANGLE) = on * sine, B(B_HAND_RATE) = on * 2.0 * M_PI * (f + sweep * s) * cosine;
        B(B_HAND_TORQUE) = 0.0, B(B_HAND_GRIP) = 1.0;
    }
}

static void drive(lane *restrict b) {
    const double h = PERIOD / SUBSTEPS;
    EACH_LANE {
        plant c = plant_of(b, n);
        double decay = exponential(-2.0 * M_PI * B(P_MOTOR_BANDWIDTH_HZ) * (0.5 * h));
        double level_s = B(P_STEERING_M_S_FRIC), level = B(P_STEERING_M_FRIC), target = B(B_WIRES_TARGET);
        double k_s = B(P_STEERING_C_S_FRIC) / level_s, k = B(P_STEERING_C_FRIC) / level;
        motion x = {B(S_PLANT_STEERING_ANGLE), B(S_PLANT_STEERING_RATE), B(S_PLANT_PINION_ANGLE),
                    B(S_PLANT_PINION_RATE), B(S_PLANT_LATERAL_SPEED), B(S_PLANT_YAW_RATE), B(S_PLANT_SLIP_FRONT),
                    B(S_PLANT_SLIP_REAR)};
        double wheel = B(S_PLANT_WHEEL_FRICTION), pinion = B(S_PLANT_PINION_FRICTION), M0 = B(S_PLANT_MOTOR_TORQUE);
#pragma GCC unroll 2
        for (int step = 0; step < SUBSTEPS; step++) {
            double M1 = target + (M0 - target) * decay, M2 = target + (M1 - target) * decay;
            motion k0 = rates(x, wheel, pinion, M0, &c), q = COMBINE(x, 0.5 * h, k0);
            motion k1 = rates(q, dahl(wheel, q.a - x.a, level_s, k_s), dahl(pinion, q.p - x.p, level, k), M1, &c);
            q = COMBINE(x, 0.5 * h, k1);
            motion k2 = rates(q, dahl(wheel, q.a - x.a, level_s, k_s), dahl(pinion, q.p - x.p, level, k), M1, &c);
            q = COMBINE(x, h, k2);
            motion k3 = rates(q, dahl(wheel, q.a - x.a, level_s, k_s), dahl(pinion, q.p - x.p, level, k), M2, &c);
            q = (motion){MEAN(a), MEAN(w), MEAN(p), MEAN(v), MEAN(vy), MEAN(r), MEAN(sf), MEAN(sr)};
            wheel = dahl(wheel, q.a - x.a, level_s, k_s), pinion = dahl(pinion, q.p - x.p, level, k);
            x = q, M0 = M2;
        }
        B(S_PLANT_STEERING_ANGLE) = x.a, B(S_PLANT_STEERING_RATE) = x.w, B(S_PLANT_PINION_ANGLE) = x.p;
        B(S_PLANT_PINION_RATE) = x.v, B(S_PLANT_LATERAL_SPEED) = x.vy, B(S_PLANT_YAW_RATE) = x.r;
        B(S_PLANT_SLIP_FRONT) = x.sf, B(S_PLANT_SLIP_REAR) = x.sr, B(S_PLANT_WHEEL_FRICTION) = wheel;
        B(S_PLANT_PINION_FRICTION) = pinion, B(S_PLANT_MOTOR_TORQUE) = M0;

        double M_tb = c.c_tb * (x.a - x.p) + c.b_tb * (x.w - x.v);
        motion now = rates(x, wheel, pinion, M0, &c);
        double M_eff = felt(b, n, S_JUDGE_PINION_ANGLE, x.p, x.v, now.v);
        double ideal = inverse_assist(M_eff, B(S_REFERENCE_R), B(S_REFERENCE_SIGMA)), error = M_tb - ideal;
        double limited = B(B_WIRES_LIMITED), per_rated = 1.0 / B(P_MOTOR_RATED_TORQUE);
        double change = (limited - B(S_COMMANDS_LAST_1)) * per_rated, share = limited * per_rated;
        double wanted = c.grip * (c.k * (c.hand - x.a) + c.b * (c.hand_rate - x.w)) + c.hand_torque;
        double slip = x.p * c.per_ratio - (x.vy + c.l_f * x.r) * c.per_speed;
        double thrown = MOST(fabs(x.w), fabs(x.v)) > 40.0 ? 1.0 : 0.0;
        B(B_TRUTH_TIME) = (B(B_WIRES_PERIOD) + 1.0) * PERIOD, B(B_TRUTH_SPEED) = c.speed;
        B(B_TRUTH_STEERING_ANGLE) = x.a, B(B_TRUTH_STEERING_RATE) = x.w;
        B(B_TRUTH_STEERING_TORQUE) = LEAST(MOST(wanted, -c.most), c.most);
        B(B_TRUTH_PINION_ANGLE) = x.p, B(B_TRUTH_PINION_RATE) = x.v, B(B_TRUTH_TORSION_BAR_TORQUE) = M_tb;
        B(B_TRUTH_MOTOR_TORQUE) = M0, B(B_TRUTH_COMMAND) = limited;
        B(B_TRUTH_RACK_TORQUE) = c.share * (c.load * slip + c.extra * x.p), B(B_TRUTH_YAW_RATE) = x.r;
        B(B_TRUTH_LATERAL_ACCELERATION) = (c.C_f * x.sf + c.C_r * x.sr) * c.per_m;
        B(B_TRUTH_REFERENCE) = ideal, B(B_TRUTH_ERROR) = error;
        B(B_TRUTH_REWARD_TRACKING) = -LEAST(fabs(error) / B(P_REWARD_TORQUE_SCALE), 10.0);
        B(B_TRUTH_REWARD_SMOOTHNESS) = -LEAST(B(P_REWARD_SMOOTHNESS) * change * change, 10.0);
        B(B_TRUTH_REWARD_EFFORT) = -LEAST(B(P_REWARD_EFFORT) * share * share, 10.0);
        B(B_TRUTH_UNSTABLE) = fabs(M_tb) > 60.0 ? 1.0 : thrown;
        double torque = B(P_SENSORS_TORQUE_GAIN) * M_tb + B(P_SENSORS_TORQUE_OFFSET);
        B(B_WIRES_ANGLE) = measured(x.p, B(P_SENSORS_ANGLE_STEP), B(P_SENSORS_ANGLE_NOISE), B(B_WIRES_NOISE_ANGLE));
        B(B_WIRES_TORQUE) = measured(torque, B(P_SENSORS_TORQUE_STEP), B(P_SENSORS_TORQUE_NOISE), B(B_WIRES_NOISE_TORQUE));
        B(B_WIRES_MOTOR_TORQUE) = M0;
    }
}

static void see(lane *restrict b) {
    EACH_LANE {
        double z = exponential(-2.0 * M_PI * B(P_OBSERVER_BANDWIDTH_HZ) * PERIOD), J = B(P_OBSERVER_J), o = 1.0 - z;
        double known = B(B_WIRES_TORQUE) + B(P_OBSERVER_MOTOR_RATIO) * B(B_WIRES_MOTOR_TORQUE), damping = B(P_OBSERVER_B);
        double inputs = B(P_OBSERVER_KNOWN_INPUTS), rate = B(S_OBSERVER_RATE), load = B(S_OBSERVER_LOAD);
        double a = (inputs * (known - damping * rate) - load) / J;
        double predicted = B(S_OBSERVER_ANGLE) + PERIOD * rate + 0.5 * PERIOD * PERIOD * a;
        double error = B(B_WIRES_ANGLE) - predicted, angle = predicted + (1.0 - z * z * z) * error;
        rate = rate + PERIOD * a + 1.5 * o * o * (1.0 + z) / PERIOD * error;
        load = load - J * o * o * o / (PERIOD * PERIOD) * error;
        a = (inputs * (known - damping * rate) - load) / J;
        double M_eff = felt(b, n, S_GENERATOR_PINION_ANGLE, angle, rate, a);
        double wanted = inverse_assist(M_eff, B(S_REFERENCE_R), B(S_REFERENCE_SIGMA));
        B(B_OBSERVATION_REFERENCE_RATE) = (wanted - B(S_CLOCK_LAST_REFERENCE)) / PERIOD;
        B(S_OBSERVER_ANGLE) = angle, B(S_OBSERVER_RATE) = rate, B(S_OBSERVER_LOAD) = load;
        B(B_OBSERVATION_PINION_ANGLE) = angle, B(B_OBSERVATION_PINION_RATE) = rate, B(B_OBSERVATION_PINION_ACCELERATION) = a;
        B(B_OBSERVATION_TORSION_BAR_TORQUE) = B(B_WIRES_TORQUE), B(B_OBSERVATION_REFERENCE) = wanted;
        B(B_OBSERVATION_REFERENCE_ACCELERATION) = 0.0, B(B_OBSERVATION_EFFECTIVE_TORQUE) = M_eff;
        B(B_OBSERVATION_SPEED) = B(B_WIRES_SPEED), B(S_CLOCK_LAST_REFERENCE) = wanted;
        B(S_COMMANDS_LAST_4) = B(S_COMMANDS_LAST_3), B(S_COMMANDS_LAST_3) = B(S_COMMANDS_LAST_2);
        B(S_COMMANDS_LAST_2) = B(S_COMMANDS_LAST_1), B(S_COMMANDS_LAST_1) = B(B_WIRES_LIMITED);
        B(B_OBSERVATION_LAST_TORQUE_1) = B(S_COMMANDS_LAST_1), B(B_OBSERVATION_LAST_TORQUE_2) = B(S_COMMANDS_LAST_2);
        B(B_OBSERVATION_LAST_TORQUE_3) = B(S_COMMANDS_LAST_3), B(B_OBSERVATION_LAST_TORQUE_4) = B(S_COMMANDS_LAST_4);
        B(S_CLOCK_PERIOD) = B(B_WIRES_PERIOD) + 1.0;
    }
}

typedef double line[16][WIDTH];

static inline double through(line *lines, int which, int n, int k, double value, int delay) {
    lines[which][k & 15][n] = value;
    return lines[which][(k - delay) & 15][n];
}

/* ``periods`` periods of a block with the command gain * (reference - torque); noise [WIDTH][capacity][2]. */
void run_block(lane *restrict b, line *restrict lines, const double *noise, int capacity, int periods, double gain, double *scores) {
    for (int k = 0; k < periods; k++) {
        EACH_LANE {
            B(B_WIRES_COMMAND) = gain * (B(B_OBSERVATION_REFERENCE) - B(B_OBSERVATION_TORSION_BAR_TORQUE));
            B(B_WIRES_NOISE_ANGLE) = noise[(n * capacity + k) * 2], B(B_WIRES_NOISE_TORQUE) = noise[(n * capacity + k) * 2 + 1];
        }
        command_and_hand(b);
        EACH_LANE B(B_WIRES_TARGET) = through(lines, 0, n, (int)B(B_WIRES_PERIOD), B(B_WIRES_LIMITED), (int)B(P_MOTOR_DEAD_TIME));
        drive(b);
        EACH_LANE {
            int at = (int)B(B_WIRES_PERIOD), late = (int)B(P_SENSORS_ANGLE_DELAY);
            B(B_WIRES_ANGLE) = through(lines, 1, n, at, B(B_WIRES_ANGLE), late);
            B(B_WIRES_TORQUE) = through(lines, 2, n, at, B(B_WIRES_TORQUE), (int)B(P_SENSORS_TORQUE_DELAY));
            B(B_WIRES_MOTOR_TORQUE) = through(lines, 3, n, at, B(B_WIRES_MOTOR_TORQUE), late);
        }
        see(b);
        EACH_LANE {
            double reward = B(B_TRUTH_REWARD_TRACKING) + B(B_TRUTH_REWARD_SMOOTHNESS) + B(B_TRUTH_REWARD_EFFORT);
            scores[n] += 1.0, scores[WIDTH + n] += reward, scores[2 * WIDTH + n] += B(B_TRUTH_ERROR) * B(B_TRUTH_ERROR);
        }
    }
}
