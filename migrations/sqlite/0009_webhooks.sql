-- Who outside is told of events, and what was told them: the outbox of webhooks and its log in one table.

CREATE TABLE webhook (
  webhook_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  name TEXT NOT NULL,
  url TEXT NOT NULL,
  secret TEXT NOT NULL,
  events TEXT NOT NULL,
  enabled INTEGER NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;

CREATE TABLE webhook_delivery (
  delivery_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  webhook_key INTEGER NOT NULL REFERENCES webhook (webhook_key) ON DELETE CASCADE,
  event TEXT NOT NULL,
  body TEXT NOT NULL,
  state INTEGER NOT NULL,
  created_t_ns INTEGER NOT NULL,
  attempts INTEGER NOT NULL,
  due_ran_ns INTEGER NOT NULL,
  tried_t_ns INTEGER,
  status INTEGER,
  fault TEXT NOT NULL
) STRICT;

CREATE INDEX webhook_delivery_of ON webhook_delivery (webhook_key, delivery_key);
CREATE INDEX webhook_delivery_due ON webhook_delivery (due_ran_ns) WHERE state = 0;
