/// What became of a bundle, in words. No DOM.
import type { Imported } from '../../api/bundles';

interface Flight {
  readonly mission: string;
  readonly name: string;
  readonly already: boolean;
}
export interface Came {
  readonly words: string;
  readonly flights: readonly Flight[];
  readonly left_out: readonly { readonly what: string; readonly why: string }[];
}

const counted = (n: number, one: string): string => `${n} ${one}${n === 1 ? '' : 's'}`;

export function came_of(answer: Imported): Came {
  if ('mission' in answer)
    return {
      words: answer.already
        ? 'This flight was already on this server, with the same content.'
        : 'The flight is on this server, with its calibrations.',
      flights: [{ mission: answer.mission, name: 'Replay', already: answer.already }],
      left_out: answer.left_out,
    };
  const fresh = answer.flights.filter((f) => !f.already).length;
  return {
    words: answer.already
      ? `This site was already on this server with its ${counted(answer.flights.length, 'flight')}.`
      : `The site is on this server: ${counted(fresh, 'flight')} of ${answer.flights.length} new.`,
    flights: answer.flights.map((f) => ({
      mission: f.mission,
      name: f.name || f.mission.slice(-8),
      already: f.already,
    })),
    left_out: [...answer.left_out, ...answer.flights.flatMap((f) => f.left_out)],
  };
}
