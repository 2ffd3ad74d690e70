"""One search: a method on a scene under a budget, its line, its folder, its picture."""
