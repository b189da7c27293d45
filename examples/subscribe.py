"""Where a vehicle is. Any Zenoh client reads beliefd; this one needs only `pip install eclipse-zenoh`."""

import json

import zenoh

client = '{mode: "client", connect: {endpoints: ["tcp/127.0.0.1:7447"]}}'
session = zenoh.open(zenoh.Config.from_json5(client))
subscriber = session.declare_subscriber("beliefd/v1/*/estimate/slow")
for sample in subscriber:
    estimate = json.loads(sample.payload.to_bytes())
    print(estimate["health"], estimate["position"], estimate["radius95"])
