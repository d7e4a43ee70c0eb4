-- Roles and database of a cluster, once, as the superuser of a PostgreSQL that is new: by psql, which reads the passwords from files.
\set server_password `cat "${ANCHORD_SECRETS:-/run/secrets}/server.password"`
\set worker_password `cat "${ANCHORD_SECRETS:-/run/secrets}/worker.password"`
CREATE ROLE anchord LOGIN PASSWORD :'server_password';
CREATE ROLE anchord_worker LOGIN PASSWORD :'worker_password';
CREATE DATABASE anchord OWNER anchord ENCODING 'UTF8' TEMPLATE template0;
