"""Applies the present policy in this process: who may see what, and which hub serves each grant."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

from posecast_wire import Close

from posecast_relay.auth.addresses import Addresses, may_show
from posecast_relay.auth.tokens import Tokens, Unverifiable
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.policy import (
    ANYONE,
    CAPPED,
    NO_PAST,
    REFUSALS,
    Applicant,
    Audience,
    Grant,
    Policy,
    Principal,
    Refusal,
    admit,
    explain_no_lane,
)
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Viewer
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore, RobotSource, StateStore
from posecast_relay.runtime.fan_out import FanOut

log = logging.getLogger("posecast_relay")

RENEWALS_MAX = 1000  # at once; further ones are dropped, and their viewers keep the old token until it ends

REJUDGED_AT_ONCE = 100  # viewers in one turn of the loop when the policy changes: about 5 ms
RECHECK_S = 300.0  # between checks whether viewers' accounts were signed out, disabled or revoked


class Access:
    """Access control of one process. `later`: the dispatcher of the DelayedHub, if the process has one."""

    def __init__(
        self,
        live: Dispatcher,
        policy: Policy = Policy(),  # noqa: B008
        later: Dispatcher | None = None,
        tokens: Tokens | None = None,
        origins: Collection[str] = (),
        addresses: Addresses | None = None,
        has_past: bool = False,
    ) -> None:
        """`has_past`: whether this process serves the past. Only then can it send viewers to the lane when
        it is full.
        """
        self.live = live
        self.later = later
        self.policy = policy
        self.tokens = tokens
        self.origins = origins
        self.has_past = has_past
        self.addresses = Addresses(live.hub.limits.per_address) if addresses is None else addresses
        self._renewals: set[asyncio.Task[None]] = set()
        self._outdated: deque[Viewer] = deque()  # those to whom the present policy has yet to be applied
        self._readmitting: asyncio.Handle | None = None
        self._followers: list[Callable[[Policy], None]] = []
        self._reported_full: set[str | None] = set()  # why there was no lane; None: there was one
        if later is not None:
            self._delayed.set_delays(policy.find_delays_s())
        self._tell_recorder()

    @property
    def dispatchers(self) -> tuple[Dispatcher, ...]:
        """The dispatchers of live and of delayed viewers."""
        return (self.live,) if self.later is None else (self.live, self.later)

    @property
    def _delayed(self) -> DelayedHub:
        assert self.later is not None
        assert isinstance(self.later.hub, DelayedHub)
        return self.later.hub

    def find_refusal(self, applicant: Applicant) -> Refusal | None:
        """Return why an applicant is refused, if that is known already; else None."""
        decision = admit(applicant, self.policy, self.has_past)
        return decision if isinstance(decision, Refusal) else None

    def admit(self, applicant: Applicant) -> Grant | Refusal:
        """Return the grant for a robot, or why it is refused.

        Call this only after the attempt to identify the applicant.
        """
        decision = admit(applicant, self.policy, self.has_past)
        assert decision is not None
        return decision

    def enter_address(self, applicant: Applicant, peer: str, forwarded: str | None) -> str | Refusal:
        """Count one more stream of an address. When the stream ends, call `addresses.leave`.

        Returns a Refusal if the applicant or the address may not have another stream.
        """
        refusal = self.find_refusal(applicant)
        if refusal is not None and refusal.at_door:
            return refusal
        address = self.addresses.enter(peer, forwarded)
        if address is not None:
            return address
        crowded = self.admit(replace(applicant, is_crowded=True))
        assert isinstance(crowded, Refusal)
        return crowded

    async def identify(self, token: str) -> Principal | Close:
        """Return who owns a token; TOKEN if it is invalid, FULL if it can't be verified now."""
        if self.tokens is None:
            return ANYONE
        try:
            found = await self.tokens.identify(token)
        except Unverifiable as e:
            self.live.handshakes["unverifiable"] += 1
            log.warning("a token can't be verified: %s", e)
            return Close.FULL
        if found is None:
            self.live.handshakes["bad token"] += 1
            return Close.TOKEN
        return found

    def may_show(self, origin: str | None, host: str | None) -> bool:
        """Whether a page of this origin may show views that are not open to anyone."""
        return may_show(origin, host, self.origins)

    def list_frame_ancestors(self, robot: str) -> tuple[str, ...]:
        """Return the sites that may embed a robot, as sources for CSP's `frame-ancestors`. `robot` "" stands
        for any robot.
        """
        return self.policy.list_frame_ancestors(robot, self.origins)

    def find_dispatcher(self, grant: Grant) -> Dispatcher:
        """Return the dispatcher that serves viewers with this grant: the live or the delayed one."""
        return self.later if grant.delay_s > 0 and self.later is not None else self.live

    def find_robot(self, grant: Grant) -> tuple[Robot, Room | None] | None:
        """Return the robot as the grant shows it, and the room of its view; None if it was never heard."""
        of = self.find_dispatcher(grant).hub.robots.get(grant.robot)
        if of is None or of.heard_at is None:
            return None
        return of, of.rooms.get(grant.view)

    def count_viewers(self, robot: str) -> int:
        """Return a robot's viewers over all processes."""
        here = [of for each in self.dispatchers if (of := each.hub.robots.get(robot)) is not None]
        return sum(of.count_viewers() for of in here) + self.live.store.count_viewers_elsewhere(robot)

    def set_policy(self, policy: Policy) -> None:
        """Replace the policy. Connected viewers get their new rights; those without any are closed.

        Many viewers are served in slices, one per turn of the loop, so that everybody's frames go on.
        """
        self.policy = policy
        self._tell_recorder()
        for follow in self._followers:
            try:
                follow(policy)
            except Exception as e:  # viewers have to get their new rights
                self.live.report_fault("the rules", e)
        if self.later is not None:
            self._delayed.set_delays(policy.find_delays_s())
            live = self.live.hub.robots
            for robot, view in policy.find_delays_s():  # state that is already here is not announced again
                if robot in live and view in live[robot].rooms:
                    _record_for_later(
                        self.live.hub, self._delayed, self.later, live[robot].rooms[view].stream
                    )
        if self._readmitting is not None:
            self._readmitting.cancel()
        self._outdated = deque(viewer for dispatcher in self.dispatchers for viewer in dispatcher.hub.viewers)
        self._readmit_some()

    def _readmit_some(self) -> None:
        """Apply the policy to the next REJUDGED_AT_ONCE viewers, and to the others in later turns."""
        for _ in range(min(REJUDGED_AT_ONCE, len(self._outdated))):
            viewer = self._outdated.popleft()
            if viewer.grant is None:
                continue
            who: Principal | Close = viewer.grant.who
            if viewer.grant.who.audience is Audience.LINK and self.tokens is not None:
                who = (
                    self.tokens.identify_link(viewer.grant.who.token) or Close.TOKEN
                )  # its key may have changed
            self._readmit(viewer, who)
        is_done = not self._outdated
        self._readmitting = None if is_done else asyncio.get_running_loop().call_soon(self._readmit_some)

    def on_policy(self, follow: Callable[[Policy], None]) -> None:
        """Call `follow` with the policy now, and each time it is replaced."""
        self._followers.append(follow)
        follow(self.policy)

    def tell_full(self, viewer: Viewer, lane: str | None) -> None:
        """Log that the relay is full and what viewers get instead. Logs each reason once."""
        why = None if lane else self._explain_no_lane(viewer)
        if why in self._reported_full:
            return
        self._reported_full.add(why)
        fate = "are sent to its lane" if why is None else f"are refused, without a lane, because {why}"
        most = self.live.hub.limits.viewers
        log.warning("full with %d viewers (--max-viewers): more viewers of %r %s", most, viewer.robot, fate)

    def _explain_no_lane(self, viewer: Viewer) -> str:
        if not self.has_past:
            return NO_PAST
        return explain_no_lane(self.policy, viewer.robot, viewer.asked_view) or CAPPED

    def _tell_recorder(self) -> None:
        """Give the policy to the recorder of the live hub: it decides who can look back."""
        if self.live.hub.recorder is not None:
            self.live.hub.recorder.set_policy(self.policy, self.live.now())

    def _readmit(self, viewer: Viewer, who: Principal | Close) -> None:
        """Apply the policy to a connected viewer again. Close the viewer if that fails."""
        dispatcher = next(
            (dispatcher for dispatcher in self.dispatchers if viewer in dispatcher.hub.viewers), None
        )
        if dispatcher is None:
            return
        try:
            self._apply_policy(dispatcher, viewer, who)
        except Exception as e:
            dispatcher.report_fault("a viewer's rights", e)
            refusal = REFUSALS[Close.INTERNAL_ERROR]
            dispatcher.carry_out(dispatcher.hub.refuse(viewer, refusal.close, refusal.reason))

    def _apply_policy(self, dispatcher: Dispatcher, viewer: Viewer, who: Principal | Close) -> None:
        found = self.admit(Applicant(viewer.robot, viewer.asked_view, who=who))
        if isinstance(found, Refusal):
            dispatcher.carry_out(dispatcher.hub.refuse(viewer, found.close, found.reason))
        else:
            viewer.set_expiry(self.live.compute_expiry(found.who.until_s))
            dispatcher.carry_out(dispatcher.hub.replace_grant(viewer, found, dispatcher.now()))

    def renew(self, viewer: Viewer, token: str) -> None:
        """Verify a token that a viewer has just sent, and apply the policy to the viewer again."""

        async def renew() -> None:
            try:
                who = await self.identify(token)
            except Exception as e:
                self.live.report_fault("a viewer's token", e)
                who = Close.INTERNAL_ERROR
            self._readmit(viewer, who)

        if self.tokens is not None and viewer.grant is not None and len(self._renewals) < RENEWALS_MAX:
            task = asyncio.create_task(renew(), name="token")
            self._renewals.add(task)
            task.add_done_callback(self._renewals.discard)

    async def recheck_accounts(self) -> None:
        """Check the accounts of connected viewers every RECHECK_S seconds, until cancelled."""
        while True:
            await asyncio.sleep(RECHECK_S)
            try:
                await self.recheck_once()
            except Exception as e:
                self.live.report_fault("checking accounts", e)

    async def recheck_once(self) -> None:
        """Close viewers whose account is no longer valid. If one can't be checked, its viewers stay."""
        judged: dict[str, Principal | Close] = {}
        for dispatcher in self.dispatchers:
            for viewer in tuple(dispatcher.hub.viewers):
                who = viewer.grant.who if viewer.grant is not None else ANYONE
                if who.audience is Audience.SIGNED_IN:
                    if who.token not in judged:
                        judged[who.token] = await self.identify(who.token)
                    if judged[who.token] == Close.TOKEN:
                        self._readmit(viewer, Close.TOKEN)


def open_access(
    hub: Hub,
    delayed: DelayedHub | None,
    store: StateStore,
    fan_out: FanOut,
    source: RobotSource | None = None,
    policy: Policy = Policy(),  # noqa: B008
    tokens: Tokens | None = None,
    origins: Collection[str] = (),
    addresses: Addresses | None = None,
    has_past: bool = False,
) -> Access:
    """Create one dispatcher for each hub of a process, and the access control in front of them."""

    def renew(viewer: Viewer, token: str) -> None:
        access.renew(viewer, token)  # made below: dispatcher and access control refer to each other

    def tell_full(viewer: Viewer, lane: str | None) -> None:
        access.tell_full(viewer, lane)

    if delayed is None:
        live, later = Dispatcher(hub, store, fan_out, source, renew, full=tell_full), None
    else:
        later = Dispatcher(delayed, MemoryStore(), fan_out, verify=renew, full=tell_full)
        record = partial(_record_for_later, hub, delayed, later)
        live = Dispatcher(hub, store, fan_out, source, renew, record, tell_full)
    access = Access(live, policy, later, tokens, origins, addresses, has_past)
    return access


def _record_for_later(live: Hub, delayed: DelayedHub, later: Dispatcher, stream: Stream) -> None:
    """Record the state of a stream for the delayed hub, if it is shown there."""
    robot = live.robots.get(stream.robot)
    token = robot is not None and robot.liveness.token
    if delayed.record_stream(stream, token, later.now()):
        later.arm()
