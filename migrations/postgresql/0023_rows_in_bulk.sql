-- A foreign key is looked up with each row: half of what a range costs PostgreSQL. Every transaction that stores rows reads their
-- mission first and is serialisable, so that a mission which another one deletes meanwhile undoes one of the two (docs/adr/0010).
ALTER TABLE uwb_range DROP CONSTRAINT uwb_range_mission_key_fkey;
ALTER TABLE fix DROP CONSTRAINT fix_mission_key_fkey;
ALTER TABLE cir DROP CONSTRAINT cir_range_id_fkey;

CREATE FUNCTION remove_rows_of_missions() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
  DELETE FROM uwb_range WHERE mission_key IN (SELECT mission_key FROM removed);
  DELETE FROM fix WHERE mission_key IN (SELECT mission_key FROM removed);
  RETURN NULL;
END $$;
CREATE TRIGGER mission_removed AFTER DELETE ON mission REFERENCING OLD TABLE AS removed
  FOR EACH STATEMENT EXECUTE FUNCTION remove_rows_of_missions();

CREATE FUNCTION remove_cirs_of_ranges() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
  DELETE FROM cir WHERE range_id IN (SELECT range_id FROM removed);
  RETURN NULL;
END $$;
CREATE TRIGGER range_removed AFTER DELETE ON uwb_range REFERENCING OLD TABLE AS removed
  FOR EACH STATEMENT EXECUTE FUNCTION remove_cirs_of_ranges();

-- Nothing is found to compress in an impulse response, and looking for it costs a third of storing it.
ALTER TABLE cir ALTER COLUMN re_im SET STORAGE EXTERNAL;
