-- Of PostgreSQL alone: what a row of measurements costs there.
SELECT 1;
