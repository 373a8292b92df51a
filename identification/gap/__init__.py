"""The gap workflow: where simulation and measurement disagree, what is missing, and what it explains.

model        what a kind of campaign offers: records, nominal unknowns, a simulation, a catalogue
"""
