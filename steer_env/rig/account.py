"""What a session tells of itself: in a line for messages, and for ``info``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from steer_env.rig.motors.motor import DriveStatus

if TYPE_CHECKING:
    from steer_env.rig.session import RigSession

NO_STATUS = DriveStatus("off", (), "not heard of yet")


def in_a_line(rig: RigSession) -> str:
    """State of drive, safety and bus."""
    faults = f" ({', '.join(rig.status.faults)})" if rig.status.faults else ""
    heard = "" if rig.reading else ", no measurement came"
    heard += "" if rig.drive_limit.settled else ", its own torque limit is not known"
    bus, detail = rig.link.health().state, rig.status.detail
    return f"drive {rig.status.state}{faults}, {detail}{heard}; bus {bus}; {rig.safety.state.value}"


def silence(rig: RigSession) -> str:
    """What to look at where nobody ever answered; "" where somebody did."""
    if rig.reading is not None or rig.status is not NO_STATUS:
        return ""
    return (
        f". Nothing on this bus answers as {rig.motor.name}: is it on (or 'steer-env rig virtual' running), "
        "and are motor, channel, port, bit rate and node right?"
    )


def for_info(rig: RigSession) -> dict[str, Any]:
    """SI; times on the link's clock, ``device_time`` on the interface's.

    ``host_time`` is when the measurement was read, ``arrival_time`` when it came.
    """
    health, reading = rig.link.health(), rig.reading
    received = math.nan if reading is None else reading.host_time
    return {
        "sample_age": rig.link.now() - received,
        "host_time": received,
        "arrival_time": rig.arrived,
        "device_time": math.nan if reading is None else reading.device_time,
        "sensor_torque": rig.gauge.sensor_torque,
        "round_trip": rig.round_trip,
        "late": rig.late,
        "skipped": rig.skipped,
        "overruns": rig.pacer.overruns,
        "energy": rig.safety.energy,
        "limited_by": rig.safety.limited_by,
        "safety": rig.safety.state.value,
        "trip_reason": rig.safety.trip_reason,
        "drive": rig.status.state,
        "drive_limit": rig.drive_limit.torque,
        "drive_faults": rig.status.faults,
        "rejected": rig.rejected,
        "foreign": rig.foreign,
        "bus": health.state,
        "error_frames": health.error_frames,
        "send_errors": health.send_errors,
    }
