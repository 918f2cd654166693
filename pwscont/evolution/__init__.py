"""Evolutions of systems with memory: all ways on, from event to event."""
