"""What every training and every policy here shares."""
