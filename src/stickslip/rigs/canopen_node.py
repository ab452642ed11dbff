"""A node of a CANopen bus for its configuration (CiA 301): objects by SDO, PDOs and emergencies."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from stickslip.core.errors import DriveFault, InputError, MessageLost, RigError
from stickslip.rigs import cia402 as cia

if TYPE_CHECKING:
    import canopen

STANDARD = [{"can_id": 0, "can_mask": 0, "extended": False}]
"""python-can's filter that passes only 11-bit identifiers"""
FORMATS = {1: "<B", 2: "<H", 4: "<I"}


class CanopenNode:
    """A node by its number; `name` is used in messages.

    Attributes
    ----------
    error : int
        Code of the last emergency since the connection, 0: none.
    """

    def __init__(self, name: str, number: int) -> None:
        self.name, self.number = name, number
        self.error = 0
        self._network: canopen.Network | None = None

    # ---- the bus -----------------------------------------------------------------------------------------------

    def connect(self, bus: Mapping[str, Any]) -> None:
        """Open the bus by these arguments of python-can's ``can.Bus``.

        Raises
        ------
        InputError
            Without `canopen`, or if the bus cannot be opened.
        """
        try:
            import can
            import canopen
        except ModuleNotFoundError:
            raise InputError("ds402 needs canopen; run `pip install 'stickslip[canopen]'`") from None
        network = canopen.Network()
        network.NOTIFIER_CYCLE = 0.02
        try:
            # Identifiers of 29 bits belong to other protocols: truncated to 11 bits they could match this node.
            arguments: dict[str, Any] = {"can_filters": STANDARD, **bus}
            network.bus = can.Bus(**arguments)
            network.connect()  # pyright: ignore[reportUnknownMemberType]
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise InputError(f"{self.name}: the bus {dict(bus)} cannot be opened: {error}") from None
        self._network = network
        self.error = 0
        node = network.add_node(self.number, canopen.ObjectDictionary())
        node.sdo.RESPONSE_TIMEOUT = 0.5
        network.subscribe(0x80 + self.number, self.on_emergency)

    @property
    def network(self) -> canopen.Network:
        """Network of the connection.

        Raises
        ------
        RigError
            If it is not connected.
        """
        if self._network is None:
            raise RigError(f"{self.name} is not open; use it in a Loop")
        return self._network

    def leave(self) -> canopen.Network | None:
        """Release the network and return it, so the caller can disconnect; None if there was none."""
        network, self._network = self._network, None
        return network

    def on_emergency(self, _: int, data: bytearray, __: float) -> None:
        """Keep the code of an emergency; code 0 (cause removed) does not clear it."""
        self.error = struct.unpack_from("<H", data)[0] or self.error

    # ---- its objects -------------------------------------------------------------------------------------------

    def read(self, index: int, sub: int = 0) -> int:
        """Read an object of the node, unsigned."""
        data = self._sdo("upload", index, sub)
        return int.from_bytes(data, "little")

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        """Write an object with a given number of bytes."""
        self._sdo("download", index, sub, struct.pack(FORMATS[size], value))

    def _sdo(self, verb: str, index: int, sub: int, *data: bytes) -> bytes:
        import canopen

        sdo: Any = self.network[self.number].sdo
        try:
            return getattr(sdo, verb)(index, sub, *data) or b""
        except canopen.SdoAbortedError as error:
            raise InputError(
                f"{self.name}: the drive refuses {verb} of {index:04X}h:{sub}: {error}"
            ) from None
        except canopen.SdoCommunicationError as error:
            raise MessageLost(f"{self.name}: no answer to {verb} of {index:04X}h:{sub} ({error})") from None

    def wait_for(self, index: int, good: Callable[[int], bool], complaint: str, seconds: float = 0.5) -> None:
        """Read an object until its value is accepted.

        Raises
        ------
        DriveFault
            With the given message, if that does not happen in time.
        """
        end = time.monotonic() + seconds
        while not good(self.read(index)):
            if time.monotonic() > end:
                raise DriveFault(f"{self.name}: {complaint}")

    def map_pdo(self, parameters: int, mapping: int, cob: int, objects: Mapping[int, int]) -> None:
        """Map objects (index to bits) into the first PDO of a kind; CiA 301, 7.5.2.36."""
        self.write(parameters, 1, cob | cia.OFF, 4)
        self.write(parameters, 2, cia.SYNCHRONOUS, 1)
        self.write(mapping, 0, 0, 1)
        for place, (index, bits) in enumerate(objects.items(), 1):
            self.write(mapping, place, index << 16 | bits, 4)
        self.write(mapping, 0, len(objects), 1)
        self.write(parameters, 1, cob, 4)
