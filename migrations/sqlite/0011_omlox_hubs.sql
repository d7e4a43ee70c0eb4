-- A receiver may be an omlox hub: what it is, how it writes points, and the token it is sent.

ALTER TABLE webhook ADD COLUMN kind INTEGER NOT NULL DEFAULT 0;
ALTER TABLE webhook ADD COLUMN dialect INTEGER NOT NULL DEFAULT 0;
ALTER TABLE webhook ADD COLUMN token TEXT NOT NULL DEFAULT '';
