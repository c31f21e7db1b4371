"""Hears estimates by real ROS 1; run by the Python that has rospy, not by ours.

Prints at the end, in JSON: how many estimates came, the names and numbers of the last, and what the
last status said.
"""

import json
import sys
import threading


def listen():
    """Until the standard input ends."""
    import rospy
    from rospy.msg import AnyMsg

    heard = {"estimates": 0, "names": "", "values": [], "status": 0, "types": {}}

    def take(message, name):
        heard[name] += 1
        heard["types"][name] = message._connection_header["type"]

    def number(message):
        heard["estimates"] += 1
        heard["names"] = message.layout.dim[0].label
        heard["values"] = list(message.data)

    rospy.init_node("listener", disable_signals=True)
    from std_msgs.msg import Float64MultiArray

    rospy.Subscriber("/palpate/estimate", Float64MultiArray, number, tcp_nodelay=True)
    rospy.Subscriber("/palpate/status", AnyMsg, take, callback_args="status")
    print("listening", flush=True)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    ended.wait()
    print(json.dumps(heard), flush=True)


if __name__ == "__main__":
    listen()
