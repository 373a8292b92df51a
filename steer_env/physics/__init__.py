"""The equations, once: plain scalar functions that every other part of the project calls.

To add an equation, write a function of floats and NamedTuples of floats, mark it ``@scalar`` and
give it a docstring with its units, equation number and source. Compiled entry points are few: they
stand in ``steer_env/envs/batch.py``, ``steer_env/envs/cell.py`` and ``steer_env/testcar/kernel.py``.
"""
