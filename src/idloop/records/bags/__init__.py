"""Bags of any distribution as arrays, and arrays as bags."""
