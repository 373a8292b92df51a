"""91 ways in which a campaign can be wrong, and what the message must name.

``BROKEN``: name -> (how to spoil the valid folder, parts of the message). The first run is the one
that is spoiled where a run file is.
"""

import numpy as np

from tests.identification.breakers import (
    CSV,
    FIRST,
    Breaker,
    add,
    as_drive,
    at,
    cell,
    duplicate_run,
    empty_folder,
    huge_run,
    jitter,
    line,
    missing_file,
    other_format,
    renamed,
    run,
    run_bytes,
    run_is_a_folder,
    scaled,
    swapped,
    toml,
    toml_bytes,
    toml_runs,
    without,
    without_table,
    write,
)

MAP = "[channels]\n"
FREQUENCY = 'manoeuvre = "frequency_response"'

BROKEN: dict[str, tuple[Breaker, tuple[str, ...]]] = {
    # the folder and campaign.toml as a file
    "empty folder": (empty_folder, ("empty",)),
    "no campaign.toml": (lambda f: (f / "campaign.toml").unlink(), ("campaign.toml",)),
    "empty toml": (toml_bytes(b""), ("campaign.toml", "empty")),
    "binary toml": (toml_bytes(bytes(range(256))), ("campaign.toml", "UTF-8")),
    "latin-1 toml": (
        toml_bytes('name = "Prüfgelände"'.encode("latin-1")),
        ("campaign.toml", "byte"),
    ),
    "truncated toml": (toml("[steering]", "[steer"), ("campaign.toml", "line 13")),
    "5000 digits": (toml("1640.0", "9" * 5000), ("campaign.toml",)),
    "huge toml": (toml_bytes(b"# " + b"x" * 2_000_000), ("campaign.toml", "bytes")),
    "key twice": (toml("mass_kg", "steering_ratio = 16.0\nmass_kg"), ("campaign.toml", "line")),
    # keys and values
    "future schema": (toml("schema_version = 1", "schema_version = 2"), ("schema_version",)),
    "no schema": (toml("schema_version = 1\n", ""), ("schema_version", "missing")),
    "unknown key": (toml('name = "', 'nmae = "x"\nname = "'), ("'nmae'", "write 'name'")),
    "unknown kind": (toml('"vehicle"', '"vehicel"'), ("'kind'", "write 'vehicle'")),
    "empty name": (toml('"synthetic single track"', '" "'), ("'name'",)),
    "no vehicle": (without_table("[vehicle]", "[steering]"), ("'vehicle'", "[vehicle]")),
    "no steering": (without_table("[steering]", "[[runs]]"), ("'steering'", "[steering]")),
    "no mass": (toml("mass_kg = 1640.0\n", ""), ("[vehicle]", "'mass_kg'", "missing")),
    "misspelt mass": (toml("mass_kg", "mas_kg"), ("'mas_kg'", "write 'mass_kg'")),
    "mass in tonnes": (toml("1640.0", "1.64"), ("'mass_kg'", "physical range")),
    "mass as text": (toml("1640.0", '"1640"'), ("'mass_kg'", "number")),
    "mass nan": (toml("1640.0", "nan"), ("'mass_kg'", "finite")),
    "vehicle in a drive": (toml('"vehicle"', '"drive"'), ("'vehicle'", "drive")),
    "runs missing": (lambda f: toml_runs(f, ""), ("'runs'",)),
    "runs empty": (lambda f: toml_runs(f, "runs = []"), ("'runs'",)),
    "run with unknown key": (toml(FREQUENCY, FREQUENCY + "\nrepeat = 1"), ("runs[0]", "'repeat'")),
    "run without manoeuvre": (toml(FREQUENCY + "\n", ""), ("runs[0]", "'manoeuvre'")),
    "unknown manoeuvre": (
        toml('frequency_response"', 'frequency_respons"'),
        ("runs[0]", "'frequency_response'"),
    ),
    "unknown role": (toml('"auto"', '"test"'), ("runs[0]", "'role'")),
    "speed as text": (toml("60.0", '"60"'), ("runs[0]", "'speed_kmh'")),
    "speed zero": (toml("60.0", "0.0"), ("runs[0]", "'speed_kmh'")),
    "speed negative": (toml("60.0", "-60.0"), ("runs[0]", "'speed_kmh'")),
    "run listed twice": (duplicate_run, ("runs[1]", "twice")),
    "absolute path": (toml(FIRST, "/etc/passwd"), ("runs[0]", "outside")),
    "path out of the folder": (toml(FIRST, "../other/run.csv"), ("runs[0]", "outside")),
    "missing run": (missing_file, (CSV, "does not exist", "_frequency_response_")),
    "run is a folder": (run_is_a_folder, (CSV, "folder")),
    "unknown ending": (toml(".csv", ".xlsx"), (".xlsx", ".parquet")),
    "nothing to identify": (
        lambda f: write(
            f / "campaign.toml",
            (f / "campaign.toml").read_bytes().replace(b'"auto"', b'"validate"'),
        ),
        ("'role'", "identify"),
    ),
    # the map of channels
    "unknown channel": (add(MAP + 'yaw_rate = { source = "r" }'), ("'yaw_rate'", "yaw_rate_radps")),
    "map without source": (add(MAP + 'yaw_rate_radps = { unit = "deg/s" }'), ("'source'",)),
    "unknown unit": (
        add(MAP + 'yaw_rate_radps = { source = "r", unit = "furlong" }'),
        ("yaw_rate_radps", "'unit'", "furlong"),
    ),
    "unit of another dimension": (
        add(MAP + 'steering_torque_Nm = { source = "steering_torque_Nm", unit = "deg" }'),
        ("steering_torque_Nm", "'unit'", "angle"),
    ),
    "column used twice": (
        add(MAP + 'yaw_rate_radps = { source = "r" }\nsideslip_angle_rad = { source = "r" }'),
        ("'r'", "two channels"),
    ),
    "mapped column in no run": (
        add(MAP + 'yaw_rate_radps = { source = "yaw_rate_radp" }'),
        ("'yaw_rate_radps'", "yaw_rate_radp"),
    ),
    "scale zero": (
        add(MAP + 'rack_force_N = { source = "rack_force_N", scale = 0 }'),
        ("'scale'",),
    ),
    "first for a force": (
        add(MAP + 'rack_force_N = { source = "rack_force_N", offset = "first" }'),
        ("'offset'", "time_s"),
    ),
    # the run file as a file
    "empty csv": (run_bytes(lambda b: b""), (CSV, "empty")),
    "header only": (run_bytes(lambda b: b.partition(b"\n")[0]), (CSV, "not one sample")),
    "no header": (run_bytes(lambda b: b.partition(b"\n")[2]), (CSV, "line 1", "header")),
    "binary csv": (run_bytes(lambda b: bytes(range(256)) * 50), (CSV, "binary")),
    "utf-16 csv": (run_bytes(lambda b: b.decode().encode("utf-16")), (CSV, "UTF-16")),
    "latin-1 header": (
        run_bytes(lambda b: b.replace(b"sideslip", "größe".encode("latin-1"))),
        (CSV, "line 1", "UTF-8"),
    ),
    "semicolons": (run_bytes(lambda b: b.replace(b",", b";")), (CSV, "line 1", "semicolons")),
    "huge csv": (huge_run, (CSV, "GB")),
    "cut off": (run_bytes(lambda b: b[:-40]), (CSV, "line 877", "cut off")),
    "ragged line": (line(9, lambda text: text + ",1.0"), (CSV, "line 9", "12 cells")),
    "blank line": (line(9, lambda text: ""), (CSV, "line 9", "blank")),
    "text in numbers": (line(7, cell(3, "n/a")), (CSV, "line 7", "'pinion_angle_rad'", "n/a")),
    "decimal text": (line(7, cell(3, "1_000")), (CSV, "line 7", "'pinion_angle_rad'")),
    "empty cell": (line(7, cell(8, "")), (CSV, "line 7", "'yaw_rate_radps'", "empty")),
    "column twice": (
        renamed("rack_force_N", "yaw_rate_radps"),
        (CSV, "line 1", "'yaw_rate_radps'"),
    ),
    "damaged parquet": (other_format(".parquet"), (".parquet", "not a readable")),
    "damaged mf4": (other_format(".mf4"), (".mf4", "not a readable")),
    # what is in the columns
    "NaN": (at("yaw_rate_radps", 100, np.nan), (CSV, "line 102", "'yaw_rate_radps'")),
    "infinity": (at("rack_force_N", 5, np.inf), (CSV, "line 7", "'rack_force_N'")),
    "NaN in time": (at("time_s", 5, np.nan), (CSV, "line 7", "'time_s'")),
    "no time": (run(without("time_s")), (CSV, "'time_s'", "missing")),
    "only time": (run(lambda c: {"time_s": c["time_s"]}), (CSV, "no channel besides time")),
    "time backwards": (at("time_s", 100, 0.5), (CSV, "line 102", "backwards")),
    "time stands still": (at("time_s", 100, 1.98), (CSV, "line 102", "stands still")),
    "gap": (
        run(lambda c: {n: np.delete(x, slice(200, 240)) for n, x in c.items()}),
        (CSV, "line 202", "gap"),
    ),
    "jitter of 60 %": (run(jitter), (CSV, "line", "jitters")),
    "time in ms": (scaled("time_s", 1e3), (CSV, "'time_s'", "unit")),
    "too short": (run(lambda c: c, seconds=8.0), (CSV, "line 402", "frequency_response", "10 s")),
    "few samples": (run(lambda c: {n: x[::150] for n, x in c.items()}), (CSV, "'time_s'")),
    "wrong speed": (scaled("vehicle_speed_mps", 1.2), (CSV, "'vehicle_speed_mps'", "speed_kmh")),
    "speed in km/h": (scaled("vehicle_speed_mps", 3.6), (CSV, "looks like km/h")),
    "wheel angle in degrees": (scaled("steering_angle_rad", 57.3), (CSV, "'steering_angle_rad'")),
    "pinion angle in degrees": (scaled("pinion_angle_rad", 57.3), (CSV, "'pinion_angle_rad'")),
    "bar torque in mN m": (scaled("torsion_bar_torque_Nm", 1e3), (CSV, "'torsion_bar_torque_Nm'")),
    "acceleration in g": (
        scaled("lateral_acceleration_mps2", 1 / 9.81),
        (CSV, "'lateral_acceleration_mps2'"),
    ),
    "yaw rate in degrees": (scaled("yaw_rate_radps", 57.3), (CSV, "'yaw_rate_radps'")),
    "yaw rate to the right": (
        scaled("yaw_rate_radps", -1.0),
        (CSV, "'yaw_rate_radps'", "opposite"),
    ),
    "rack force in kN": (scaled("rack_force_N", 1e-3), (CSV, "'rack_force_N'")),
    "unit in the name": (
        renamed("steering_angle_rad", "steering_angle_deg"),
        (CSV, "'steering_angle_deg'", 'unit = "'),
    ),
    "angles swapped": (swapped("steering_angle_rad", "pinion_angle_rad"), (CSV, "swapped")),
    "torque and angle swapped": (
        swapped("steering_angle_rad", "steering_torque_Nm"),
        (CSV, "'steering_angle_rad'", "swapped"),
    ),
    "yaw rate and acceleration swapped": (
        swapped("yaw_rate_radps", "lateral_acceleration_mps2"),
        (CSV, "'yaw_rate_radps'"),
    ),
    "angle never moves": (scaled("pinion_angle_rad", 0.0), (CSV, "never moves")),
    "angle jumps": (
        run(
            lambda c: {
                **c,
                "steering_angle_rad": c["steering_angle_rad"] + 6.28 * (c["time_s"] > 5),
            }
        ),
        (CSV, "line 253", "'steering_angle_rad'"),
    ),
    "drive without torque": (
        lambda f: (run(without("steering_torque_Nm"))(f), as_drive("")(f)),
        (CSV, "steering_torque_Nm", "missing"),
    ),
}
