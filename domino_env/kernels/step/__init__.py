"""One step of the environments: an action places a domino, the leader falls onto it.

batch        rules, episodes and arrays of B environments
action       the mapping of actions, forwards, inverted and backwards
observation  the entries of an observation
environment  resetting and stepping a batch in one call
"""
