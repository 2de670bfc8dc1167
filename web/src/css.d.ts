// esbuild turns style sheets into studio.css, or into text for reports and notebooks.
declare module "*.css" {
  const text: string;
  export default text;
}
