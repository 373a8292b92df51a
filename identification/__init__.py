"""Measurements in, parameters out: campaigns, frequency responses, steps I to III and the refinement.

Estimators follow scikit-learn's manners: the constructor stores, ``fit`` works and returns self,
fitted values end in an underscore (``params_``, ``std_``).
"""
