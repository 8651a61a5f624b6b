"""Verifies the ID tokens of Firebase sign-in. Needs `posecast-relay[firebase]`."""

from __future__ import annotations

import firebase_admin
from firebase_admin import auth, credentials, exceptions
from google.auth.credentials import AnonymousCredentials

from posecast_relay.auth.tokens import PATIENCE_S, Unverifiable
from posecast_relay.core.policy import Audience, Principal


class _Nobody(credentials.Base):  # type: ignore[misc]
    """Anonymous credentials: checking signatures needs only public certificates."""

    def get_credential(self) -> AnonymousCredentials:
        """Return anonymous credentials."""
        return AnonymousCredentials()  # type: ignore[no-untyped-call]


class Firebase:
    """The accounts of one Firebase project. Methods may block, because they sometimes fetch certificates."""

    def __init__(self, project: str, check_revoked: bool) -> None:
        """`check_revoked`: ask Google about the account each time; this needs a service account."""
        known = credentials.ApplicationDefault() if check_revoked else _Nobody()
        options = {"projectId": project, "httpTimeout": PATIENCE_S}  # nobody waits longer
        self.app = firebase_admin.initialize_app(known, options, "posecast")
        self._check_revoked = check_revoked

    def verify(self, token: str) -> Principal | None:
        """Return who owns an ID token; None if it is invalid.

        Raises Unverifiable if Google does not answer.
        """
        try:
            found = auth.verify_id_token(token, self.app, check_revoked=self._check_revoked)
            return Principal(Audience.SIGNED_IN, None, float(found["exp"]), token)
        except (ValueError, auth.InvalidIdTokenError, auth.UserDisabledError, auth.UserNotFoundError):
            return None  # ValueError: the token is empty
        except (exceptions.FirebaseError, OSError) as e:
            raise Unverifiable(type(e).__name__) from None
