/// How long a flight took beside what was forecast at Start: whoever reads it knows how far the next forecast can be trusted.
import { useEffect, useState } from 'preact/hooks';
import { flight_time_of } from '../../api/missions';
import { flight_time_words, type FlightTime as Time } from './flight_time_words';

export function FlightTime({ mission }: { mission: string }) {
  const [time, set_time] = useState<Time | null>(null);
  useEffect(() => {
    let gone = false;
    flight_time_of(mission).then(
      (t) => {
        if (!gone) set_time(t);
      },
      () => undefined, // beside the result, not needed for it
    );
    return () => {
      gone = true;
    };
  }, [mission]);
  if (!time) return null;
  const off = time.against_forecast === 'shorter' || time.against_forecast === 'longer';
  return (
    <p class={off ? 'why caution' : 'why'} data-testid="flown-time">
      {flight_time_words(time)}
    </p>
  );
}
