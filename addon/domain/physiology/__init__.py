"""Recordings of pulse oximeters and skin analysers: read, cleaned, and turned into changes from each subject's own rest."""
