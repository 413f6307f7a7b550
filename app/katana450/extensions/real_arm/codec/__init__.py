"""The protocol between host and arm as values and bytes, without input or output of its own.

Both ends use it: ``HostCodec`` for a driver, ``FirmwareCodec`` for an emulator.
"""
