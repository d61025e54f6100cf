"""Bytes to arrays and cameras, and back."""
