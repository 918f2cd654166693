"""Accuracy and time of the steppers on problems whose answer is known."""
