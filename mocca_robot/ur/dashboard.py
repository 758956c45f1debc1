"""The controller's dashboard (port 29999): questions before anything moves, and a way to stop that needs no RTDE."""

from __future__ import annotations

import socket
from dataclasses import dataclass

from mocca_robot.errors import EnvironmentNeeded

PORT = 29999
TIMEOUT_S = 2.0


class DashboardLost(Exception):
    """The dashboard did not answer; what the robot does is unknown."""


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Which robot answers, and in which state it is."""

    model: str
    serial: str
    polyscope: str
    robot_mode: str
    safety_status: str
    remote_control: bool
    program_running: bool


def identify(host: str) -> Identity:
    """Return what the controller at `host` says about itself; EnvironmentNeeded when it cannot be reached."""
    try:
        answers = _ask(
            host,
            "get robot model",
            "get serial number",
            "PolyscopeVersion",
            "robotmode",
            "safetystatus",
            "is in remote control",
            "running",
        )
    except DashboardLost as error:
        raise EnvironmentNeeded(
            f"No robot answers at {host}, port {PORT} ({error}). Check the address, the cable and that the dashboard "
            "service is enabled (Settings, Security, Services)."
        ) from error
    model, serial, polyscope, mode, safety, remote, running = answers
    return Identity(
        model=model,
        serial=serial,
        polyscope=polyscope,
        robot_mode=mode.removeprefix("Robotmode:").strip(),
        safety_status=safety.removeprefix("Safetystatus:").strip(),
        remote_control=remote.strip().lower() == "true",
        program_running=running.strip().lower().endswith("true"),
    )


def stop_program(host: str) -> bool:
    """Order the controller to stop its program; return whether it then said that none is running."""
    try:
        return _ask(host, "stop", "running")[1].strip().lower().endswith("false")
    except DashboardLost:
        return False


def show(host: str, text: str) -> bool:
    """Show a popup on the pendant, or close it with ''; return whether the controller did."""
    plain = " ".join(text.split())
    try:
        return "popup" in _ask(host, f"popup {plain}" if plain else "close popup")[0].lower()
    except DashboardLost:
        return False


def safety_status(host: str) -> str | None:
    """Return the controller's safety status in its own words, None when it does not answer."""
    try:
        return _ask(host, "safetystatus")[0].removeprefix("Safetystatus:").strip()
    except DashboardLost:
        return None


def _ask(host: str, *questions: str) -> list[str]:
    try:
        with socket.create_connection((host, PORT), timeout=TIMEOUT_S) as connection:
            stream = connection.makefile("rw", encoding="utf-8", newline="\n")
            if not stream.readline():
                raise DashboardLost("it closed the connection")
            answers = []
            for question in questions:
                stream.write(question + "\n")
                stream.flush()
                answer = stream.readline()
                if not answer:
                    raise DashboardLost("it closed the connection")
                answers.append(answer.strip())
            return answers
    except (OSError, UnicodeDecodeError) as error:
        raise DashboardLost(str(error) or type(error).__name__) from error
