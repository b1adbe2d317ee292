"""Emergency messages (EMCY), as text. Source: CiA 301 version 4.2, tables 26 and 43."""

from __future__ import annotations

from typing import Final

from canopen.emcy import EmcyError

_EXACT: Final = {
    0x8110: "CAN overrun, messages lost",
    0x8120: "CAN in error passive mode",
    0x8130: "heartbeat of the host lost",
    0x8140: "recovered from bus-off",
    0x8150: "identifier collision",
    0x8210: "PDO not processed due to its length",
    0x8220: "PDO longer than its mapping",
    0x8240: "unexpected length of SYNC",
    0x8250: "time-out of an RPDO",
}
_REGISTER: Final = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "device profile",
    "reserved",
    "manufacturer",
)


def emergency_text(code: int, register: int, data: bytes) -> str:
    """An error code with its meaning, the bits of the error register, and the maker's bytes."""
    meaning = _EXACT.get(code)
    if meaning is None:
        general = EmcyError(code, register, data, 0.0).get_desc()
        meaning = general.lower() or "not in the table of CiA 301"
    bits = [name for place, name in enumerate(_REGISTER) if register >> place & 1]
    text = f"EMCY 0x{code:04X}, {meaning}"
    if bits:
        text += f"; error register {', '.join(bits)}"
    if any(data):
        text += f"; maker's data {data.hex(' ')}"
    return text
