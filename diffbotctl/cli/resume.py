"""`diffbotctl resume`: a person's consent to move again."""

from __future__ import annotations

from typing import Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, held_by, settled


@click.command()
@engine_option
def command(engine: str | None) -> int:
    """Let the robot move again after a stop that waits for a person. A waiting goal goes on.

    It ends what holds the robot now, not what may stop it later; where nothing was stopped and no
    goal waited, it says so and fails.
    """
    with attached(engine, "resume") as caller:
        before = caller.ask("status")
        caller.ask("resume")
        if held_by(before):
            after = settled(caller, lambda status: not held_by(status))
        elif waits(before):
            after = settled(caller, lambda status: not waits(status))
        else:
            after = before
    done, words = outcome(before, after)
    click.echo(words, err=not done)
    return 0 if done else 1


def waits(status: dict[str, Any]) -> bool:
    """Whether a goal was withdrawn while a person drove, and waits for consent."""
    goal = status["operator.goal"]
    return goal is not None and goal["number"] == 0


def outcome(before: dict[str, Any], after: dict[str, Any]) -> tuple[bool, str]:
    """Whether the consent ended anything, and what to say of it: the status before and after."""
    held, still = held_by(before), held_by(after)
    if still and (after["held"]["latched"] or still == held):
        way_out = (
            "" if after["held"]["latched"] else "; that ends by itself when its cause has gone"
        )
        return False, f"still held by {still}{way_out}"
    done = [f"released from {held}"] if held else []
    if waits(before) and not waits(after):
        done.append(f"goal {after['operator.goal']['number']} goes on")
    if still:
        done.append(f"now held by {still}, which ends by itself")
    if done:
        return True, "; ".join(done)
    return False, f"nothing is stopped and no goal waits, so nothing was done; {_goal(after)}"


def _goal(status: dict[str, Any]) -> str:
    from diffbotctl.messages import GoalState
    from diffbotctl.recording.json_codec import message_reader
    from diffbotctl.ui.message_text import goal_state

    said = status["goal_state"]
    if said is None:
        return "no goal is under way"
    state: GoalState = message_reader(GoalState)(said)
    return f"goal {state.number}: {goal_state(state)}"
