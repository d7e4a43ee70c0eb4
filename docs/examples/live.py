# python3 live.py ws://127.0.0.1:8420 TOKEN system: prints what a topic says, one JSON a line (Debian: python3-websockets; pip: websockets,
# where the headers have another name since version 14).
import asyncio, inspect, json, sys, websockets

async def follow(url, token, topic):
    login = {"Authorization": "Bearer " + token}
    named = "extra_headers" if "extra_headers" in inspect.signature(websockets.connect).parameters else "additional_headers"
    async with websockets.connect(url + "/api/v1/ws", subprotocols=["anchord.v1"], **{named: login}) as socket:
        await socket.send(json.dumps({"op": "sub", "id": 1, "topic": topic}))
        async for message in socket:
            if (message := json.loads(message))["op"] in ("snap", "data"):
                print(json.dumps(message["data"]), flush=True)

asyncio.run(follow(*sys.argv[1:]))
