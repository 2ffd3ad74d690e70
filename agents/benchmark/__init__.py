"""Algorithms that learn against each other, over scenes and seeds: runs, page, pictures."""
