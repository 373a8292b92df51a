"""A force-feedback motor on a CAN bus: frames, motors, and a virtual motor that answers like the real one.

    frame.py     the seam between simulation and hardware: one CAN frame
    bus.py       a bus of python-can, opened and closed safely
    motors/      one file per motor: torque to frames, frames to samples
    virtual/     the other end: drive, plant and wire, with faults to be switched on

python-can and cantools are needed only here, and are imported when a bus or a motor is made: ``pip install ".[rig]"``.
"""
