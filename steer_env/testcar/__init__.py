"""The virtual test vehicle: stands in for the proving ground.

It is richer than what is identified from it.

parameters        what the car, its control unit and the steering robot are
car, kernel       its equations, and one run as one compiled loop
harmonics         the car alone on a sine, seen as a single track
plan, drive       what is driven, and one run driven and logged
logger            what the data acquisition makes of a run
truth             the linear parameters that an identification should find, from the same physics
campaign_writer   runs and campaign.toml on disk

Nothing here imports reference generators or identification: recovery must be a judgement, not an
identity.
"""
