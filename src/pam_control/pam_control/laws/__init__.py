"""The control laws, which compute the desired pressures of a joint. One file per law."""
