"""What a search asked for and was answered: budgets, journals, scores found elsewhere."""
