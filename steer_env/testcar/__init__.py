"""The virtual test vehicle: stands in for the proving ground, and is richer than what is identified from it.

parameters   what the car, its control unit and the steering robot are
kernel       one run as one compiled loop
logger       what the data acquisition makes of a run
truth        the linear parameters that an identification should find, derived from the same physics
campaign_writer   runs and campaign.toml on disk

Nothing here imports reference generators or identification: recovery must be a judgement, not an identity.
"""
