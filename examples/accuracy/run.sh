#!/bin/sh
# Measures the fronts of speed and accuracy of docs/measurements/accuracy.md, and writes the presets of lathe.pcad anew: under two hours
# on two cores that do nothing else. Taken up where it was interrupted when it is told the same OUT.
#
#     examples/accuracy/run.sh OBJECTS PEOPLE OUT
#
# OBJECTS, PEOPLE: folders of cases (docs/howto/presets.md). PCADLANG: the program (built if not given).
# The presets of human.pcad are not written: its settings differ in the body, which is not among the errors (docs/measurements/accuracy.md).
set -eu
[ $# -eq 3 ] || { sed -n '5,7s/^# *//p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
objects=$(cd "$1" && pwd)
people=$(cd "$2" && pwd)
if [ -z "${PCADLANG:-}" ]; then
  (cd "$root" && cargo build --release --bin pcadlang)
  PCADLANG=$root/target/release/pcadlang
fi
mkdir -p "$3" && cd "$3"

# Variants with other kernels. A bank belongs to the text of its program, so each size has a program.
sed -e 's|= edges as picture;|= edges with coarse = scene.contour(view, size = 40) as picture;|' \
    -e 's|= photo as colour;|= photo with coarse = flat() as colour;|' \
    -e 's|=> drift(\$affine + @H + @r0 + \$camera);|=> delayed(drift($affine + @H + @r0 + $camera), at = @picture + @colour);|' \
    -e 's|=> drift(\$profile);|=> delayed(drift($profile), at = @picture + @colour);|' \
    "$root/programs/lathe.pcad" > lathe_delayed.pcad
camera=$(find "$objects" -name camera.json | sort | head -n 1)
for n in 1000 20000; do
  sed "s|=> drift(\$wall);|&\n        0.05 => knn(@**, bank = \"lathe_$n.bank\", k = 10);|" \
    "$root/programs/lathe.pcad" > lathe_bank_$n.pcad
  [ -e lathe_$n.bank ] || "$PCADLANG" learn lathe_bank_$n.pcad -n $n -o lathe_$n.bank ${camera:+--camera "$camera"}
done
for variant in lathe_delayed.pcad lathe_bank_*.pcad; do
  # A pattern that no longer fits lathe.pcad would measure lathe.pcad by another name.
  ! cmp -s "$root/programs/lathe.pcad" $variant || { echo "$variant is lathe.pcad itself" >&2; exit 1; }
done

"$PCADLANG" tradeoff lathe.pcad --cases "$objects" --seeds 2 --budget 70m --out objects \
  --settings "$root/programs/lathe.settings.json" --settings "$here/objects.settings.json" \
  --presets "$root/programs/lathe.quality.json"
"$PCADLANG" tradeoff human.pcad --cases "$people" --budget 45m --out people \
  --settings "$root/programs/human.settings.json" --settings "$here/people.settings.json"

mkdir -p "$root/docs/measurements/accuracy"
cp objects/table.csv "$root/docs/measurements/accuracy/objects.csv"
cp objects/plot.svg "$root/docs/measurements/accuracy/objects.svg"
