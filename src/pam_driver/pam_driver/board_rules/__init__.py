"""The conformance test of a valve board: every rule of docs/can_protocol.md, played on a bus."""
