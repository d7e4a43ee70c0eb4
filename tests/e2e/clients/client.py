"""A program as an integrator writes it: quicktype made model.py from the contract, the standard library sends.
Every answer goes through the generated classes, which refuse what the contract does not say. Prints what
clients.test.mjs expects, as JSON."""
import json
import sys
import urllib.error
import urllib.request

import model

url, token = sys.argv[1:3]


def call(method, path, body=None):
    """Status and JSON of an answer, whatever the status is."""
    request = urllib.request.Request(url + path, method=method, headers={"Authorization": "Bearer " + token})
    if body is not None:
        request.data = json.dumps(body).encode()
        request.add_header("Content-Type", "application/json")
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as refused:
        return refused.code, json.load(refused)


write = model.MissionCreate.from_dict(
    {"name": "from a generated client", "frame": "wgs84", "track_point": "gnss_antenna", "tags": []})
made = model.Mission.from_dict(call("POST", "/api/v1/missions?devices=false", write.to_dict())[1])

row = model.RangeIn.from_dict({"t_us": 1777889472345678, "tag": "0x6e01", "anchor": "0x6a2f", "distance_m": 7.412,
                               "mission": str(made.id)})
second = {**row.to_dict(), "seq": 2, "distance_m": 7.5}
counts = model.IngestAnswer.from_dict(call("POST", "/api/v1/ranges", [row.to_dict(), second])[1])

refused_status, refused = call("POST", "/api/v1/ranges", [{**row.to_dict(), "distance_m": 0}])
problem = model.IngestProblem.from_dict(refused)

listed = call("GET", "/api/v1/ranges?mission=" + str(made.id))[1]
ranges = [model.Range.from_dict(one) for one in listed["items"]]
anchors = model.AnchorCollection.from_dict(call("GET", "/api/v1/anchors")[1])
absent_status, absent = call("GET", "/api/v1/missions/0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f")
absent = model.Problem.from_dict(absent)

print(json.dumps({
    "mission": {"state": made.state.value, "year": made.created_at.year},
    "counts": {"accepted": counts.accepted, "rejected": counts.rejected},
    "refused": {"status": refused_status, "type": problem.type, "rejected": problem.rejected},
    "distances": sorted(one.distance_m for one in ranges),
    "anchors": len(anchors.features),
    "absent": {"status": absent_status, "detail": absent.detail},
}))
