"""`locust -f loadtests/locustfile.py`: viewers of one robot, each checking its sequence numbers.

locust -f loadtests/locustfile.py --headless -u 500 -r 50 -t 60s -H ws://127.0.0.1:8080 --hz 10
"""

from posecast_loadtests.user import ViewerUser

__all__ = ["ViewerUser"]
