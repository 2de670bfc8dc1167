// esbuild turns style sheets into studio.css, or into text for the report.
declare module "*.css" {
  const text: string;
  export default text;
}
