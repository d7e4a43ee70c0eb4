/// The flown time against its forecast, as a sentence. No DOM.
import type { Wire } from '../../api/contract';
import { clock } from '../../ui/format';

export type FlightTime = Wire<'FlightTime'>;

export function flight_time_words({
  forecast_s: f,
  flown_s,
  completed,
  plan_changed,
  against_forecast,
}: FlightTime): string {
  const flown = `Flown in ${clock(flown_s, true)}`;
  if (!f) return `${flown}; nothing was forecast.`;
  const both = `${flown}; forecast at Start ${clock(f.low, true)} to ${clock(f.high, true)}`;
  if (against_forecast === 'within') return `${both}: within the forecast.`;
  if (against_forecast === 'shorter') return `${both}: ${clock(f.low - flown_s, true)} shorter than forecast.`;
  if (against_forecast === 'longer') return `${both}: ${clock(flown_s - f.high, true)} longer than forecast.`;
  if (plan_changed) return `${both}. Not compared: the plan was changed in flight.`;
  return completed ? `${both}.` : `${both}. Not compared: the flight ended before its plan was flown.`;
}
