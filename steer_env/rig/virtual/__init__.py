"""The other end of the bus: a virtual motor with the drive's state machine and watchdog, a plant and a wire."""
