# Opens the folders of runs with rstan, posterior, coda and loo, and compares what they say with what the runs say.
suppressPackageStartupMessages({ library(rstan); library(posterior); library(coda); library(loo) })

fail <- function(...) { cat(..., "\n"); quit(status = 1) }
close <- function(what, a, b, tolerance = 1e-9) {
  if (!isTRUE(all.equal(a, b, tolerance = tolerance))) fail(what, ":", format(a, digits = 17), "is not", format(b, digits = 17))
}

for (run in commandArgs(trailingOnly = TRUE)) {
  files <- Sys.glob(file.path(run, "chain-*.csv"))
  # Columns may come late; any other warning would be about counts that do not fit.
  fit <- withCallingHandlers(read_stan_csv(files), warning = function(w) {
    if (!grepl("undefined values", conditionMessage(w))) fail(run, ":", conditionMessage(w))
    invokeRestart("muffleWarning")
  })
  draws <- as_draws_array(as.array(fit))
  said <- jsonlite::fromJSON(file.path(run, "summary.json"))$quantities
  compared <- 0
  asked <- 0
  for (key in names(said)) {
    # Quantities count from 0, R from 1.
    base <- sub("\\[.*", "", key)
    at <- if (grepl("[", key, fixed = TRUE)) as.integer(strsplit(gsub(".*\\[|\\]", "", key), ",")[[1]]) + 1L
    name <- if (is.null(at)) base else paste0(base, "[", paste(at, collapse = ","), "]")
    if (is.null(said[[key]]$mean)) next
    asked <- asked + 1
    if (!name %in% variables(draws)) next
    x <- extract_variable(draws, name)
    if (is.null(said[[key]]$most_frequent)) close(paste(run, key), mean(x), said[[key]]$mean)
    compared <- compared + 1
  }
  if (compared < asked / 2) fail(run, ": only", compared, "quantities were compared")
  invisible(capture.output(print(fit, pars = "lp__"), summarise_draws(draws)))
  if (length(As.mcmc.list(fit)) != length(files)) fail(run, ": not all chains")
  if (grepl("/line$", run)) {
    elpd <- suppressWarnings(loo(extract_log_lik(fit, merge_chains = FALSE)))$estimates["elpd_loo", "Estimate"]
    if (!is.finite(elpd)) fail(run, ": no elpd_loo")
  }
  if (grepl("/shapes$", run)) {
    a <- rstan::extract(fit, "a")$a
    R <- rstan::extract(fit, "R")$R
    stack <- rstan::extract(fit, "stack")$stack
    if (!identical(dim(R)[-1], c(3L, 3L)) || !identical(dim(stack)[-1], c(3L, 2L, 2L))) fail("dimensions of R, stack")
    if (any(R[, 2, 1] != 3) || any(R[, 1, 3] != 2) || any(R[, 2, 2] != 4 * a)) fail("elements of R")
    if (any(stack[, 1, 2, 1] != 3) || any(stack[, 3, 2, 2] != 12 * a)) fail("elements of stack")
  }
  cat(sprintf("%s: %d x %d draws\n", basename(run), dim(draws)[2], dim(draws)[1]))
}
