"""The address of the server for a phone, as a QR code."""
