"""Trainings with algorithms of Stable-Baselines3 and sb3-contrib.

factory      the algorithms with their classes and networks; archives of policies
scheduled    policy whose exploration noise follows a schedule
ars          ARS in a batch of environments
checkpoints  state of an algorithm, to resume a training
training     a training in progress
"""
