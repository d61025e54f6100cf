"""Conversion between file bytes and arrays or cameras."""
