"""Evaluation: what a trained or scripted policy builds, in one scene or in many."""
