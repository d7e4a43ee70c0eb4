/// Which calibrations there are.
import { list, type Wire } from './contract';

/// The newest one of this flight alone; null where it is not solved yet.
export const newest_summary = async (mission: string): Promise<Wire<'CalibrationSummary'> | null> =>
  (await list('/calibrations', { query: { limit: 50 } })).find(
    (c) => c.missions.length === 1 && c.missions[0] === mission,
  ) ?? null;
