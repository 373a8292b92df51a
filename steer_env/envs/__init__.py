"""Gymnasium environments: a plant, a reference, a driver and a manoeuvre become a task."""

from __future__ import annotations

from steer_env.envs.record_campaign import RecordCampaign
from steer_env.envs.steer_env import SteerEnv
from steer_env.envs.task import Task
from steer_env.envs.vector_env import SteerVectorEnv

__all__ = ["RecordCampaign", "SteerEnv", "SteerVectorEnv", "Task"]
