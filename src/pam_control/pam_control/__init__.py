"""Position and stiffness control of antagonistic muscle joints."""
