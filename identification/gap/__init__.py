"""The gap workflow: where simulation and measurement disagree, what is missing, and what it explains.

model             what a kind of campaign offers: records, nominal unknowns, a simulation, a catalogue
*_model           the three kinds; vehicle_kernel is the car's compiled simulation
repeats           from runs to records: what is held out, what is averaged
basis, evidence   noise, model error and likelihood in frequency
fit, covariance   least squares over all records, and how sure it is
search, verdict   screening, joint refits, what is named and by which rules
constancy         whether a named effect is the same early and late, small and large
symptoms          where simulation and measurement disagree, in words
next_measurement, probability, result, extended_model   advice, trust, gap.json, model.json
workflow          all of it in order: ``find_gap``
published_tables  the published rows over speed, asked what they lack
"""
