"""The errors that are no fault of ours: input that a user can mend, and a rig that does not obey."""


class InputError(Exception):
    """Something a user gave cannot be used.

    Args:
        where: file, and row or key inside it ("campaign.toml: vehicle.mass_kg").
        what: what is wrong with it ("is -3, must be above 0").
        mend: what to do about it ("write the mass of the car in kg").
    """

    def __init__(self, where: str, what: str, mend: str) -> None:
        # All three go to args: that is what lets the error travel between processes.
        super().__init__(where, what, mend)
        self.where, self.what, self.mend = where, what, mend

    def __str__(self) -> str:
        """One line: where, what is wrong, the mend."""
        where, what, mend = (" ".join(str(part).split()).rstrip(".") for part in self.args)
        return f"{where}: {what}. To mend it: {mend}."


class RigError(RuntimeError):
    """The rig does not do what was asked of it; it has no torque."""
