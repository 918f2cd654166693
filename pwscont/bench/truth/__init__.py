"""Known answers, in closed form or by rational arithmetic."""
