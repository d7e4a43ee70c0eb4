-- How well the lever arms of a mission were measured, one sigma; NULL: nobody says.
ALTER TABLE mission ADD COLUMN lever_arm_sigma_m REAL;
