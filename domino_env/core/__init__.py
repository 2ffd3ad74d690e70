"""What every other folder may use, and none of them owns."""
