"""Judges of a row other than the model, on hinges and on floors; what they said."""
