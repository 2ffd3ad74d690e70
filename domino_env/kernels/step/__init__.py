"""Step of the environments: an action places a domino, and the leader falls onto it.

batch        rules, episodes and arrays of B environments
action       decoding of actions, its inverse and its reverse mode
observation  entries of an observation
environment  beginning and step of a batch of episodes in one call
"""
