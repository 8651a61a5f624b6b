"""Sign-in by Firebase: whether an ID token is good, and of whom. Needs `posecast-relay[firebase]`."""

from __future__ import annotations

import firebase_admin
from firebase_admin import auth, credentials, exceptions
from google.auth.credentials import AnonymousCredentials

from posecast_relay.auth.tokens import Unverifiable
from posecast_relay.core.policy.policy import Audience, Principal


class _Nobody(credentials.Base):  # type: ignore[misc]
    """Signatures are checked by public certificates: that takes no rights, and no search for any."""

    def get_credential(self) -> AnonymousCredentials:
        """None to speak of."""
        return AnonymousCredentials()  # type: ignore[no-untyped-call]


class Firebase:
    """Accounts of one project. Its methods block: certificates are fetched now and then."""

    def __init__(self, project: str, check_revoked: bool) -> None:
        """`check_revoked` asks Google about the account each time, and takes a service account's rights."""
        known = credentials.ApplicationDefault() if check_revoked else _Nobody()
        self.app = firebase_admin.initialize_app(known, {"projectId": project}, "posecast")
        self._check_revoked = check_revoked

    def verify(self, token: str) -> Principal | None:
        """None when the token is not good. Unverifiable when Google does not answer."""
        try:
            found = auth.verify_id_token(token, self.app, check_revoked=self._check_revoked)
            return Principal(Audience.SIGNED_IN, None, float(found["exp"]), token)
        except (ValueError, auth.InvalidIdTokenError, auth.UserDisabledError, auth.UserNotFoundError):
            return None  # the first is what an empty one gets
        except (exceptions.FirebaseError, OSError) as e:
            raise Unverifiable(type(e).__name__) from None
