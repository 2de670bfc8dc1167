/* A posterior in C: the mean of a normal distribution from three numbers.
 *
 *   cargo build --release --package pcadlang-c
 *   cc crates/capi/examples/line.c -Icrates/capi/include target/release/libpcadlang_c.a -lm -lpthread -ldl -o line
 */
#include <pcadlang.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static int failed(void) {
    fprintf(stderr, "%s\n", pcad_error());
    return 1;
}

int main(void) {
    const double ys[] = {1.0, 2.0, 3.0};
    const PcadOptions options = {.seed = 1, .chains = 4, .steps = 2000};

    PcadProgram *program = pcad_parse("data ys; assume m ~ normal(0, 10); observe normal(m, 0.5) = ys;");
    if (!program || pcad_observe_array(program, "ys", ys, 3) != 0) return failed();
    PcadModel *model = pcad_compile(program);
    if (!model) return failed();
    PcadPosterior *posterior = pcad_sample(model, &options);
    if (!posterior) return failed();

    size_t count = pcad_read(posterior, "m", NULL, 0);
    double *draws = malloc(count * sizeof *draws), sum = 0;
    if (!draws || pcad_read(posterior, "m", draws, count) != count) return failed();
    for (size_t i = 0; i < count; i++) sum += draws[i];
    printf("%zu chains of %zu draws, mean %.2f\n", pcad_chains(posterior), pcad_draws(posterior), sum / count);

    /* A mistake is described with its place. */
    if (pcad_parse("let x = ;")) return 1;
    printf("%s", pcad_error());

    free(draws);
    pcad_posterior_free(posterior);
    pcad_model_free(model);
    pcad_program_free(program);
    return fabs(sum / count - 2.0) < 0.05 ? 0 : 1;
}
