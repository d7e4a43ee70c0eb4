/// From the point of the track to the tag, or to each of several.
import { useState } from 'preact/hooks';
import { typed_number } from '../../ui/typed_number';
import type { About } from './flight_files';

type Arm = readonly [number, number, number];
const MOST_TAGS = 8;

/// Those that count: of the one tag, or of each. A number that is none is NaN.
export const arms_of = (tags: readonly string[], about: About): readonly Arm[] =>
  tags.length < 2
    ? [about.lever_arm_m]
    : tags.slice(0, MOST_TAGS).map((tag) => about.lever_arms_m?.[tag] ?? about.lever_arm_m);

export function LeverArms({
  tags,
  about,
  set,
}: {
  tags: readonly string[];
  about: About;
  set: (about: About) => void;
}) {
  if (tags.length < 2)
    return (
      <ArmFields
        legend="From there to the tag: forward, left, up, m"
        of=""
        arm={about.lever_arm_m}
        set={(lever_arm_m) => set({ ...about, lever_arm_m })}
      />
    );
  return (
    <>
      <p class="caution" data-testid="import-tags">
        The ranges are of {tags.length} tags, which cannot be in one place: each has its own lever arm.
      </p>
      {tags.slice(0, MOST_TAGS).map((tag) => (
        <ArmFields
          key={tag}
          legend={`From there to tag ${tag}: forward, left, up, m`}
          of={`, tag ${tag}`}
          arm={about.lever_arms_m?.[tag] ?? about.lever_arm_m}
          set={(arm) => set({ ...about, lever_arms_m: { ...about.lever_arms_m, [tag]: arm } })}
        />
      ))}
    </>
  );
}

function ArmFields({
  legend,
  of,
  arm,
  set,
}: {
  legend: string;
  of: string;
  arm: Arm;
  set: (arm: [number, number, number]) => void;
}) {
  const [typed, type] = useState<Readonly<Record<number, string>>>({});
  return (
    <fieldset class="arm">
      <legend class="lab">{legend}</legend>
      {[0, 1, 2].map((i) => (
        <input
          key={i}
          class="cell"
          inputMode="decimal"
          aria-label={`${['Forward, m', 'Left, m', 'Up, m'][i]}${of}`}
          value={typed[i] ?? arm[i]}
          aria-invalid={Number.isNaN(arm[i])}
          onInput={(e) => {
            const text = e.currentTarget.value,
              changed = [...arm] as [number, number, number];
            changed[i] = typed_number(text) ?? 0;
            type({ ...typed, [i]: text });
            set(changed);
          }}
        />
      ))}
    </fieldset>
  );
}
