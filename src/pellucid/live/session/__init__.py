"""A live session: its plan, the tasks on the participant's screen, the server of both pages, and what follows."""
