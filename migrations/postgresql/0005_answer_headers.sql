-- An answer given again under its Idempotency-Key says where the created thing is, as the first one did.
ALTER TABLE stored_answer ADD COLUMN location TEXT COLLATE "C" NOT NULL DEFAULT '';
ALTER TABLE stored_answer ADD COLUMN etag TEXT COLLATE "C" NOT NULL DEFAULT '';
