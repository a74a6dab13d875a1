"""Readers and writers of recording files, one file for each format."""
