"""What the whole house needs and no part of it owns."""
